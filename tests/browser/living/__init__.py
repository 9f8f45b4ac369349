"""Pages of a plant whose films have been watched for two months and a half."""
